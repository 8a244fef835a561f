// Changes that a page with the address for editing may request: notes, keep, drop, stop after the
// current shot, and answers to the prompts to move hammer and laser.
// a random name of this page; a duplicated tab gets another one
const me=[...crypto.getRandomValues(new Uint8Array(8))].map(b=>b.toString(16).padStart(2,'0')).join('');
const mayEdit=()=>mine.edits&&!!state.whole?.can.edit&&state.connected;
let undoable=null;
function say(text,wrong=false,undo=null){
  undoable=undo;
  $('said').replaceChildren(el('span',{},text),...(undo?[' ',el('button',{type:'button',id:'undo',title:'take it back (u)',on:{click:takeBack}},'undo')]:[]));
  $('said').className=wrong?'wrong':'';$('said').hidden=false;
  clearTimeout(say.timer);
  say.timer=setTimeout(()=>{$('said').hidden=true;undoable=null},undo||wrong?12000:6000);
}
async function want(path,body){
  const answer=await fetch(path,{method:'POST',headers:{Authorization:'Bearer '+token,'Content-Type':'application/json'},body:JSON.stringify(body)}).catch(()=>null);
  if(!answer){say('The server cannot be reached.',true);return null}
  const told=await answer.json().catch(()=>({}));
  if(!answer.ok){say(told.error?`${told.error.what}: ${told.error.do}`:`refused (${answer.status})`,true);return null}
  return told;
}
async function overrule(record,what){
  const told=await want('/api/'+what,{record});
  if(told)say(told.done||told.later,false,record);
}
async function takeBack(){
  const record=undoable;
  if(record===null)return;
  const told=await want('/api/undo',{record});
  if(told)say(told.done||told.later);
}
function noteDialog(){
  if(!mayEdit())return;
  $('note-text').value='';$('note').showModal();$('note-text').focus();
}
$('note').addEventListener('close',async()=>{
  if($('note').returnValue!=='write'||!$('note-text').value.trim())return;
  const told=await want('/api/notes',{text:$('note-text').value});
  if(told)say(told.done==='noted'?'The note is in the log.':told.later||told.done);
});
$('end').addEventListener('click',()=>$('ending').showModal());
$('ending').addEventListener('close',async()=>{
  if($('ending').returnValue!=='end')return;
  const told=await want('/api/stop',{});
  if(told)say(told.done);
});
// the buttons of a hit
function editCell(h){
  if(!mayEdit())return[];
  const button=(text,what,title)=>el('button',{type:'button',title,on:{click:()=>what==='undo'?want('/api/undo',{record:h.record}).then(t=>t&&say(t.done||t.later)):overrule(h.record,what)}},text);
  return[el('td',{className:'edits'},...(h.kept?[button('drop','drop',`leave record ${h.record} out of the analysis (D: the newest)`)]:[button('keep','keep',`take record ${h.record} into the analysis (K: the newest)`)]),...(h.judged?[' ',button('undo','undo',`the verdict before`)]:[]))];
}
// prompts to move hammer and laser: one page at a time may answer, and only the current prompt
let holding=false,renewal=0;
const mayAnswer=()=>mayEdit()&&state.whole.can.control;
async function hold(on){
  const told=await want('/api/control',{page:me,hold:on});
  holding=!!told&&on;
  clearInterval(renewal);
  if(holding)renewal=setInterval(async()=>{if(!await want('/api/control',{page:me,hold:true})){holding=false;clearInterval(renewal);draw('control')}},4000);
  draw('control');
}
function answer(what){
  const s=state.whole.now.state;
  return want('/api/stage',{page:me,cell:s.cell,attempt:s.attempt,answer:what});
}
function answersShown(host){
  host.hidden=!state.whole.can.control;
  if(host.hidden)return;
  const other=state.whole.now.control?.page;
  const asked=state.whole.now.state?.what==='move-by-hand',kind=[mayAnswer(),holding,asked,other,state.whole.now.state?.cell,state.whole.now.state?.attempt].join();
  if(host.dataset.kind===kind)return;
  host.dataset.kind=kind;
  if(!mayAnswer()){host.replaceChildren(el('p',{className:'say'},other?'A page answers for hammer and laser.':'Answers for hammer and laser come from the terminal.'));return}
  if(!holding){host.replaceChildren(el('p',{className:'say'},other&&other!==me?'Another page answers for hammer and laser.':'The person who answers must see the rig: after “in place” the hammer strikes.',' ',el('button',{type:'button',id:'hold',on:{click:()=>hold(true)}},'answer from this page')));return}
  host.replaceChildren(el('p',{className:'answers'},...['in place','redo','skip','back'].map(t=>el('button',{type:'button',disabled:!asked,on:{click:()=>answer(t)}},t)),' ',el('button',{type:'button',on:{click:()=>hold(false)}},'let go')),el('p',{className:'say'},asked?'This page answers: “in place” lets the hammer strike.':'This page answers; there is no question now.'));
}
