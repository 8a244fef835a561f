// Ticks of an axis, computed as in report/scale.rs; a test compares the two.
const DIGIT=7,BESIDE=26,ABOVE=30,TIGHT_ABOVE=16,TIGHT_BESIDE=48,NEAR=1e-9,MOST_TICKS=200;
const exponent=v=>+v.toExponential().split('e')[1];
const power=(digit,decade)=>+(digit+'e'+decade);
const superscript=e=>String(e).replace(/-/g,'⁻').replace(/\d/g,d=>'⁰¹²³⁴⁵⁶⁷⁸⁹'[d]);
function decimals(v,places){
  if(!Number.isFinite(v))return'–';
  const text=v.toFixed(places);
  return /^-?[0.]+$/.test(text)?text.replace('-',''):text.replace('-','−');
}
const room=(label,up)=>up?ABOVE:DIGIT*[...label].length+BESIDE;
const least=up=>up?TIGHT_ABOVE:TIGHT_BESIDE;
function ticksEvery(low,high,step){
  const places=Math.max(0,-exponent(step));
  const first=Math.ceil(low/step-NEAR),last=Math.floor(high/step+NEAR);
  const count=Math.trunc(Math.min(Math.max(last-first+1,0),MOST_TICKS)),found=[];
  for(let i=0;i<count;i++){const value=(first+i)*step;found.push({value,label:decimals(value,places)})}
  return found;
}
function evenTicks(low,high,length,up){
  const span=high-low,finest=span*least(up)/length;
  let found=[];
  for(let decade=exponent(finest);decade<exponent(finest)+4;decade++)for(const digit of[1,2,5]){
    const step=power(digit,decade);
    if(step<finest)continue;
    const ticks=ticksEvery(low,high,step);
    if(ticks.length<2&&found.length)return found;
    const apart=step/span*length;
    found=ticks;
    if(apart>=Math.max(0,...found.map(t=>room(t.label,up))))return found;
  }
  return found;
}
function decadeTicks(low,high,length,up){
  const first=exponent(low),last=exponent(high),plain=low>=.1&&high<=1e5;
  const within=v=>v>=low*(1-NEAR)&&v<=high*(1+NEAR);
  const place=v=>Math.log(v/low)/Math.log(high/low)*length;
  const places=(digits,every)=>{
    const chosen=[];
    for(let decade=first;decade<=last;decade++)if(decade%every===0)for(const d of digits)if(within(power(d,decade)))chosen.push([d,decade]);
    return chosen;
  };
  const label=(digit,decade)=>plain?decimals(power(digit,decade),Math.max(0,-decade)):digit===1?'10'+superscript(decade):digit+'·10'+superscript(decade);
  const digits=[1,2,3,4,5,6,7,8,9];
  for(const[own,every]of[[digits,1],[[1,2,5],1],[[1,3],1],[[1],1],[[1],2],[[1],3],[[1],5],[[1],10]]){
    const chosen=places(own,every);
    if(chosen.length<2)break;
    let apart=true;
    for(let i=1;i<chosen.length&&apart;i++){
      const[a,b]=[chosen[i-1],chosen[i]];
      apart=Math.abs(place(power(...b))-place(power(...a)))>=Math.max(room(label(...a),up),room(label(...b),up));
    }
    if(!apart)continue;
    const all=places(Math.log10(high/low)<3?digits:[1],1);
    const named=new Set(chosen.map(c=>c.join('e')));
    return all.map(c=>({value:power(...c),label:named.has(c.join('e'))?label(...c):''}));
  }
  let end=-Infinity;
  return evenTicks(low,high,length,up).filter(t=>t.value>0).map(t=>{
    const at=Math.abs(place(t.value));
    if(at<end)return{value:t.value,label:''};
    end=at+room(t.label,up);
    return t;
  });
}
// scale: 'linear' or 'log'; length in px; up: whether the axis is vertical
const ticks=(scale,low,high,length,up)=>scale==='log'?decadeTicks(low,high,length,up):evenTicks(low,high,length,up);
